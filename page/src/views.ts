/** The views of the page, one line each: address, name, component, kinds of files that it opens and uses. */
import type { ComponentType } from "preact";

export interface View {
  name: string;
  title: string; // as a verb of an object
  load: () => Promise<{ default: ComponentType }>;
  opens: string[]; // kinds of objects of which it is the first view
  takes?: string[]; // other kinds of which it is a view
}

const DESCRIBED = ["drive", "circuit"];
const TABLES = ["other", "formula", "tank", "regulator"];
const RESULTS = ["fit", "friction map", "validation", "comparison", "sizing", "campaign"];

export const VIEWS: View[] = [
  { name: "studies", title: "Overview", load: () => import("./workspace/studies"), opens: [] },
  { name: "drive", title: "Drive", load: () => import("./drive/drive"), opens: TABLES, takes: DESCRIBED },
  { name: "simulate", title: "Simulate", load: () => import("./simulate/simulate"), opens: DESCRIBED },
  { name: "recording", title: "Recording", load: () => import("./measured/recording"), opens: ["recording"] },
  { name: "friction", title: "Friction", load: () => import("./measured/friction"), opens: ["friction map", "fit"] },
  {
    name: "control",
    title: "Control",
    load: () => import("./control/control"),
    opens: ["comparison"],
    takes: DESCRIBED,
  },
  {
    name: "validation",
    title: "Validate",
    load: () => import("./measured/validation"),
    opens: ["validation"],
    takes: [...DESCRIBED, "recording"],
  },
  { name: "sizing", title: "Sizing", load: () => import("./drive/sizing"), opens: ["task", "sizing"] },
  { name: "campaign", title: "Campaign", load: () => import("./measured/campaign"), opens: ["campaign", "protocol"] },
  { name: "datasheet", title: "Data sheet", load: () => import("./drive/datasheet"), opens: [], takes: DESCRIBED },
  { name: "handover", title: "Export", load: () => import("./drive/handover"), opens: ["fmu"], takes: DESCRIBED },
  { name: "result", title: "Values", load: () => import("./workspace/result"), opens: [], takes: RESULTS },
];

/** Return the name of the first view of a kind: undefined for a kind without one. */
export const viewOf = (kind: string): string | undefined => VIEWS.find((one) => one.opens.includes(kind))?.name;

/** Return the views of an object: the present one, the first one of its kind, and those that take the kind too. */
export const verbsOf = (view: string, kind: string): View[] =>
  VIEWS.filter((one) => one.name === view || one.name === viewOf(kind) || one.takes?.includes(kind));
