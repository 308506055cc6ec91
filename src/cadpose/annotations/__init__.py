"""What is handed out: the JSON document, overlay and candidate pictures, HTML cards, and the store."""
