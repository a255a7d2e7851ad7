"""The connection of a client, which checks what the library leaves unchecked."""

from __future__ import annotations

from websockets.frames import CloseCode

from rosbridge_sim.link.client_connection import DialedConnection

__all__ = ["CheckedConnection"]


class CheckedConnection(DialedConnection):
    """A connection that ends if a text is not valid UTF-8.

    Attributes:
        why_given_up: the reason, if it was this side that ended the connection.
    """

    why_given_up = ""

    def take_message(self, message: bytes, *, is_text: bool, last: object) -> None:
        """Hand over a message that the library has read.

        Args:
            is_text: its bytes must be UTF-8.
            last: not used.
        """
        if is_text and not message.isascii():
            try:
                message.decode()
            except UnicodeDecodeError as error:
                self.why_given_up = f"{error.reason} at position {error.start}"
                self.fail(CloseCode.INVALID_DATA, self.why_given_up)
                return
        super().take_message(message, is_text=is_text, last=last)
