"""Files that were delivered: the manifest beside them, reading them back, writing all or none."""
