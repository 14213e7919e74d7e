"""The laser line in pictures: its pieces, their centres and their ends."""
