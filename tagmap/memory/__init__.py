"""What is written in a tag's memory: the bytes, and how they are read, planned and compared."""
