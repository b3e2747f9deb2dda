"""A page in the browser where every knob of a spec is solved and drawn at once."""
