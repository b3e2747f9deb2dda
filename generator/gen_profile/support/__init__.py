"""What every chapter uses: errors, units, files, JSON, progress."""
