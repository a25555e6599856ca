/** The views of the page, one line each: address, name, component, kinds of files that it opens and uses. */
import type { ComponentType } from "preact";

export interface View {
  name: string;
  title: string; // as a verb of an object
  load: () => Promise<ComponentType>;
  opens: string[]; // kinds of objects of which it is the first view
  takes?: string[]; // other kinds of which it is a view
}

export const VIEWS: View[] = [
  {
    name: "studies",
    title: "Overview",
    load: async () => (await import("./workspace/studies")).StudiesView,
    opens: [],
  },
  {
    name: "drive",
    title: "Drive",
    load: async () => (await import("./drive/drive")).DriveView,
    opens: ["other", "formula", "tank", "regulator"],
    takes: ["drive", "circuit"],
  },
  {
    name: "simulate",
    title: "Simulate",
    load: async () => (await import("./simulate/simulate")).SimulateView,
    opens: ["drive", "circuit"],
  },
  {
    name: "recording",
    title: "Recording",
    load: async () => (await import("./measured/recording")).RecordingView,
    opens: ["recording"],
  },
  {
    name: "friction",
    title: "Friction",
    load: async () => (await import("./measured/friction")).FrictionView,
    opens: ["friction map", "fit"],
  },
  {
    name: "control",
    title: "Control",
    load: async () => (await import("./control/control")).ControlView,
    opens: ["comparison"],
    takes: ["drive", "circuit"],
  },
  {
    name: "validation",
    title: "Validate",
    load: async () => (await import("./measured/validation")).ValidationView,
    opens: ["validation"],
    takes: ["drive", "circuit", "recording"],
  },
  {
    name: "sizing",
    title: "Sizing",
    load: async () => (await import("./drive/sizing")).SizingView,
    opens: ["task", "sizing"],
  },
  {
    name: "campaign",
    title: "Campaign",
    load: async () => (await import("./measured/campaign")).CampaignView,
    opens: ["campaign", "protocol"],
  },
  {
    name: "datasheet",
    title: "Data sheet",
    load: async () => (await import("./drive/datasheet")).DatasheetView,
    opens: [],
    takes: ["drive", "circuit"],
  },
  {
    name: "handover",
    title: "Export",
    load: async () => (await import("./drive/handover")).HandoverView,
    opens: ["fmu"],
    takes: ["drive", "circuit"],
  },
  {
    name: "result",
    title: "Values",
    load: async () => (await import("./workspace/result")).ResultView,
    opens: [],
    takes: ["fit", "friction map", "validation", "comparison", "sizing", "campaign"],
  },
];

/** Return the name of the first view of a kind: undefined for a kind without one. */
export const viewOf = (kind: string): string | undefined => VIEWS.find((one) => one.opens.includes(kind))?.name;

/** Return the views of an object: the present one, the first one of its kind, and those that take the kind too. */
export const verbsOf = (view: string, kind: string): View[] =>
  VIEWS.filter((one) => one.name === view || one.name === viewOf(kind) || one.takes?.includes(kind));
