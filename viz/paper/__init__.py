"""The paper's figures and its table, written to a folder with one page of all."""
