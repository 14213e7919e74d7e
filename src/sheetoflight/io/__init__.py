"""Files at the border: each format has one codec, and every file is written whole or not at all."""
