"""The blind benchmark of the gap diagnosis: make cases, diagnose them without their labels, score, report.

`cases` plans and makes the cases, `answer` and `diagnosers` form the diagnosing process, `run` drives both and keeps
the answers, `scores` compares answer and truth, `results` writes the files.
"""
