/** The views of the page, one line each: address, name, what shows it, the kinds that it opens and those that it takes along. */
import type { ComponentType } from "preact";
import { CampaignView } from "./measured/campaign";
import { ControlView } from "./control/control";
import { DatasheetView } from "./drive/datasheet";
import { DriveView } from "./drive/drive";
import { FrictionView } from "./measured/friction";
import { HandoverView } from "./drive/handover";
import { RecordingView } from "./measured/recording";
import { SimulateView } from "./simulate/simulate";
import { SizingView } from "./drive/sizing";
import { StudiesView } from "./workspace/studies";
import { ValidationView } from "./measured/validation";

export interface View {
  name: string;
  title: string; // as a verb of an object
  show: ComponentType;
  takes: string[]; // kinds of objects that it is a verb of
}

const DRIVES = ["drive", "circuit"];

export const VIEWS: View[] = [
  { name: "studies", title: "Overview", show: StudiesView, takes: [] },
  { name: "drive", title: "Drive", show: DriveView, takes: [...DRIVES, "other", "formula"] },
  { name: "simulate", title: "Simulate", show: SimulateView, takes: DRIVES },
  { name: "recording", title: "Recording", show: RecordingView, takes: ["recording"] },
  { name: "friction", title: "Friction", show: FrictionView, takes: ["friction map", "fit"] },
  { name: "control", title: "Control", show: ControlView, takes: [...DRIVES, "comparison"] },
  { name: "validation", title: "Validate", show: ValidationView, takes: [...DRIVES, "recording", "validation"] },
  { name: "sizing", title: "Sizing", show: SizingView, takes: ["task", "sizing"] },
  { name: "campaign", title: "Campaign", show: CampaignView, takes: ["campaign", "protocol"] },
  { name: "datasheet", title: "Data sheet", show: DatasheetView, takes: DRIVES },
  { name: "handover", title: "Export", show: HandoverView, takes: [...DRIVES, "fmu"] },
];
