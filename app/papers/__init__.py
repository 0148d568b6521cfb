"""The figures of three publications beside the model's own, with what their texts state and what the model gives."""

from app.papers.gallery import PAPERS, Claim, Paper, PaperFigure, judged, paper, within_part, write_paper

__all__ = ["PAPERS", "Claim", "Paper", "PaperFigure", "judged", "paper", "within_part", "write_paper"]
