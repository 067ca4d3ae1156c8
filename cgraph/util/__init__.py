"""What any part uses: arrays as callers give them, files written whole, work shared among threads."""
