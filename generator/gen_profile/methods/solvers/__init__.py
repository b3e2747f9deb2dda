"""From a spec to a motion, optimal or shaped: methods, search for least values, and what else would do."""
