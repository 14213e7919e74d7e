"""The commands ``sheetoflight`` and ``sol``: options in, text and exit status out."""
