"""The page of `pneudrive web`: a server for one user on this machine, over a folder of files.

It holds no numerics: it calls what the command line and Python call, and packs results for a page that draws them.
"""
