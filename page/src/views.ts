/** The views of the page, one line each: address, name, component, kinds of files that it opens and uses. */
import { lazy } from "./lazy";

export interface View {
  name: string;
  title: string; // as a verb of an object
  View: ReturnType<typeof lazy>;
  opens: string[]; // kinds of objects of which it is the first view
  takes?: string[]; // other kinds of which it is a view
}

const DESCRIBED = ["drive", "circuit"];
const TABLES = ["other", "formula", "tank", "regulator"];
const RESULTS = ["fit", "friction map", "validation", "comparison", "sizing", "campaign"];

export const VIEWS: View[] = [
  { name: "studies", title: "Overview", View: lazy(() => import("./workspace/studies")), opens: [] },
  { name: "drive", title: "Drive", View: lazy(() => import("./drive/drive")), opens: TABLES, takes: DESCRIBED },
  { name: "simulate", title: "Simulate", View: lazy(() => import("./simulate/simulate")), opens: DESCRIBED },
  { name: "recording", title: "Recording", View: lazy(() => import("./measured/recording")), opens: ["recording"] },
  {
    name: "friction",
    title: "Friction",
    View: lazy(() => import("./measured/friction")),
    opens: ["friction map", "fit"],
  },
  {
    name: "control",
    title: "Control",
    View: lazy(() => import("./control/control")),
    opens: ["comparison"],
    takes: DESCRIBED,
  },
  {
    name: "validation",
    title: "Validate",
    View: lazy(() => import("./measured/validation")),
    opens: ["validation"],
    takes: [...DESCRIBED, "recording"],
  },
  { name: "sizing", title: "Sizing", View: lazy(() => import("./drive/sizing")), opens: ["task", "sizing"] },
  {
    name: "campaign",
    title: "Campaign",
    View: lazy(() => import("./measured/campaign")),
    opens: ["campaign", "protocol"],
  },
  {
    name: "datasheet",
    title: "Data sheet",
    View: lazy(() => import("./drive/datasheet")),
    opens: [],
    takes: DESCRIBED,
  },
  { name: "handover", title: "Export", View: lazy(() => import("./drive/handover")), opens: ["fmu"], takes: DESCRIBED },
  { name: "result", title: "Values", View: lazy(() => import("./workspace/result")), opens: [], takes: RESULTS },
];

/** Return the name of the first view of a kind: undefined for a kind without one. */
export const viewOf = (kind: string): string | undefined => VIEWS.find((one) => one.opens.includes(kind))?.name;

/** Return the views of an object: the present one, the first one of its kind, and those that take the kind too. */
export const verbsOf = (view: string, kind: string): View[] =>
  VIEWS.filter((one) => one.name === view || one.name === viewOf(kind) || one.takes?.includes(kind));
