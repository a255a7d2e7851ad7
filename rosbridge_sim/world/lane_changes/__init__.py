"""Lane changes: reasons, gaps, safety, and the motion from lane to lane."""
