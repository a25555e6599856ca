"""The page of `pneudrive web`: a server for one user on this machine, over a folder of files.

The server computes nothing itself. It calls the functions behind the command line and the Python interface, and
sends their results to a page, which draws them.
"""
