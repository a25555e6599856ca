"""Examples at the end of the help of each command."""

#: Command -> its examples.
EXAMPLES: dict[str, tuple[str, ...]] = {
    "catalogue": (
        "pneudrive catalogue --kind valve --flow '500 l/min ANR .. 800 l/min ANR'",
        "pneudrive catalogue starter --out drive.toml",
    ),
    "components": ("pneudrive components flow-control",),
    "check": ("pneudrive check drive.toml",),
    "draw": ("pneudrive draw drive.toml --out circuit.svg",),
    "schema": ("pneudrive schema drive",),
    "simulate": (
        "pneudrive simulate catalogue:parker-osp-p25-mpye --duration '2 s' \\",
        "    --command '0 s: 0.3, 1 s: -0.3' --plot run.png",
    ),
    "sweep": (
        "pneudrive sweep drive.toml --command 1 --duration '0.5 s' --members 100 \\",
        "    --vary 'load.mass = uniform(1 kg, 4 kg)' --out many.parquet",
    ),
    "lines": ("pneudrive lines catalogue:reference --length '0.5 m, 2 m'",),
    "platform": (
        "pneudrive platform tripod.toml",
        "pneudrive platform tripod.toml --run run.parquet --out motion.gif",
    ),
    "web": ("pneudrive web my-studies", "ssh -L 8123:127.0.0.1:8123 HOST   # with --port 8123 on HOST"),
    "layout": ("pneudrive layout bench.csv --out layout.toml",),
    "characterise": (
        "pneudrive characterise bench/*.csv --layout layout.toml --out results",
        "pneudrive characterise my-campaign --out results",
    ),
    "campaign plan": ("pneudrive campaign plan quick-look --rig default",),
    "campaign run": ("pneudrive campaign run quick-look --rig default --out first-look",),
    "campaign resume": ("pneudrive campaign resume first-look",),
    "campaign status": ("pneudrive campaign status first-look",),
    "campaign pause": ("pneudrive campaign pause first-look --now",),
    "campaign abort": ("pneudrive campaign abort first-look",),
    "rig serve": ("pneudrive rig serve default",),
    "rig certificate": ("pneudrive rig certificate server --out certificates",),
    "rig user": ("pneudrive rig user anna --user-file certificates/users",),
    "reproduce": ("pneudrive reproduce --out figures",),
    "compare": ("pneudrive compare before after --out compared", "pneudrive compare old.toml new.toml"),
    "fit": ("pneudrive fit map.parquet --hold-out pressure --out fit.toml",),
    "identify": (
        "pneudrive identify drive.toml run.parquet --out fit.toml \\",
        "    --free friction.coulomb,friction.viscous",
    ),
    "apply": ("pneudrive apply fit.toml drive.toml --out measured.toml",),
    "validate": ("pneudrive validate measured.toml other.parquet --out check",),
    "design": ("pneudrive design fit.toml --rig my-rig.toml --out next.toml",),
    "report": ("pneudrive report fit.toml --map map.parquet --out page",),
    "size": ("pneudrive size task.toml --out sized",),
    "datasheet": ("pneudrive datasheet drive.toml --out sheet.html",),
    "characteristic": ("pneudrive characteristic drive.toml stiffness",),
    "control tune": ("pneudrive control tune axis.toml --law super-twisting --out controller.toml",),
    "control run": (
        "pneudrive control run axis.toml --controller controller.toml \\",
        "    --reference '220 mm; 0.5 s: 280 mm in 0.3 s' --plot move.png",
    ),
    "control benchmark": ("pneudrive control benchmark axis.toml --laws pid,nmpc --out compared",),
    "control reference": ("pneudrive control reference R1 --drive axis.toml",),
    "control export": (
        "pneudrive control export controller.toml --to c --out source",
        "pneudrive control export nmpc --drive axis.toml --to fmu --reference R1 \\",
        "    --out law.fmu",
    ),
    "export": (
        "pneudrive export drive.toml --to fmu --out drive.fmu",
        "pneudrive export fit.toml --to modelica --out friction.mo",
    ),
}
