"""The page of `pneudrive web`: a server for one user on this machine, over a folder of files.

It computes nothing itself: it calls the same functions as the command line and Python, and packs results for a page
that draws them.
"""
