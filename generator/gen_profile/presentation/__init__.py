"""What a person looks at: the studio, reports, and charts."""
