"""Speed: our machine code beside other software, on the same tasks in turns."""
