"""Studies. They use only the public interface, like the study of a user."""
