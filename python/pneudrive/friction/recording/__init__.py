"""The friction of recordings: map, closure, lines over pressure."""
