"""Helpers of every part: arrays as callers give them, files written whole, work shared among threads."""
