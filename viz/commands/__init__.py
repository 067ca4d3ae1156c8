"""Commands of the command line `cgraph`, a file each: its arguments, and the function that it runs."""
