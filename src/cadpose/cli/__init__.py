"""The command line: verbs only. They parse, call and print."""
