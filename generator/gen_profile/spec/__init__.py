"""What a user states: read, validated, typed."""
