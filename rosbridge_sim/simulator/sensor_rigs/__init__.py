"""The sensors of egos: rigs that the user chooses, their files, and the component that publishes their messages."""
