"""A re-checker of certificates that shares nothing with the program that makes them (docs/certificate.md)."""
