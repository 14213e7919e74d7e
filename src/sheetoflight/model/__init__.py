"""The nouns of the field: frozen values, checked when they are made."""
