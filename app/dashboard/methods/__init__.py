"""Methods of the analysis page: each under the view of the chain it belongs to."""
