"""Studies, which use only the public interface, like a study of a user."""
