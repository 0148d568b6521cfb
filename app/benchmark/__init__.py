"""The blind benchmark of the gap diagnosis: cases made, diagnosed where no label is, scored, reported.

`cases` says which cases and makes them, `answer` and `diagnosers` are all that the diagnosing process gets, `run`
drives both and keeps answers, `scores` puts answer and truth side by side, `results` writes files.
"""
