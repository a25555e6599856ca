"""Studies, written with the public interface only, like a user's study."""
