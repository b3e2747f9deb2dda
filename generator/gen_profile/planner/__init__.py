"""Planning in the controller: a function block for a machine of a spec, and its execution here."""
