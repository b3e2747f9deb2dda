"""The evidence for an artefact: verdicts, certificates, and proofs of planner blocks."""
