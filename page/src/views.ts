/** The views of the page, one line each: address, name, component, kinds of files that it opens and uses. */
import { lazy } from "./workspace/fields";

const DESCRIBED = ["drive", "circuit"];
const TABLES = ["other", "formula", "tank", "regulator"];
const RESULTS = ["fit", "friction map", "validation", "comparison", "sizing", "campaign"];

type Load = Parameters<typeof lazy>[0];
/** A view with its title as a verb, the kinds of objects of which it is the first view, and others that it takes. */
const view = (name: string, title: string, load: Load, opens: string[], takes: string[] = []) => {
  return { name, title, View: lazy(load), opens, takes };
};

export const VIEWS = [
  view("studies", "Overview", () => import("./workspace/studies"), []),
  view("drive", "Drive", () => import("./drive/drive"), TABLES, DESCRIBED),
  view("simulate", "Simulate", () => import("./simulate/simulate"), DESCRIBED),
  view("recording", "Recording", () => import("./measured/recording"), ["recording"]),
  view("friction", "Friction", () => import("./measured/friction"), ["friction map", "fit"]),
  view("control", "Control", () => import("./control/control"), ["comparison"], DESCRIBED),
  view("validation", "Validate", () => import("./measured/validation"), ["validation"], [...DESCRIBED, "recording"]),
  view("sizing", "Sizing", () => import("./drive/sizing"), ["task", "sizing"]),
  view("campaign", "Campaign", () => import("./measured/campaign"), ["campaign", "protocol"]),
  view("datasheet", "Data sheet", () => import("./drive/datasheet"), [], DESCRIBED),
  view("handover", "Export", () => import("./drive/handover"), ["fmu"], DESCRIBED),
  view("result", "Values", () => import("./workspace/result"), [], RESULTS),
];

/** Return the name of the first view of a kind: undefined for a kind without one. */
export const viewOf = (kind: string): string | undefined => VIEWS.find((one) => one.opens.includes(kind))?.name;

/** Return the views of an object: the present one, the first one of its kind, and those that take the kind too. */
export const verbsOf = (view: string, kind: string): typeof VIEWS =>
  VIEWS.filter((one) => one.name === view || one.name === viewOf(kind) || one.takes.includes(kind));
