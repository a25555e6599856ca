"""The page of `pneudrive web`: a server for one user on this machine, over a folder of files.

The server computes nothing itself. It calls the functions of the command line and of Python, and sends results to a
page that draws them.
"""
