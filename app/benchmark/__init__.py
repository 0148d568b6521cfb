"""The blind benchmark of the gap diagnosis: cases made, diagnosed where no label is, scored, reported.

`plan` says which cases, `make` records them, `seen` and `diagnose_one` are all that the diagnosing process gets,
`run` drives both and keeps answers, `scoring` puts answer and truth side by side.
"""
