"""Answers against truths: `judged` pairs them, `scores` counts, `strata` counts by parts, `results` writes files."""
