// The schemas of the API that the page works with, by their own names.

import type { components } from "./schema";

type Schemas = components["schemas"];

export type Reconstruction = Schemas["Reconstruction"];
export type Sheet = Schemas["Sheet"];
export type Page = Schemas["Page"];
export type PageFigure = Schemas["PageFigure"];
export type FigureEdit = Schemas["FigureEdit"];
export type PageEdit = Schemas["PageEdit"];
export type PageSummary = Schemas["PageSummary"];
export type Link = Schemas["Link"];
export type Artifact = Schemas["Artifact"];
export type JobState = Schemas["JobState"];
export type Progress = Schemas["Progress"];
export type SheetDocument = Schemas["SheetDocument"];
/** What all kinds of jobs have in common. */
export type AnyJob = Reconstruction | Sheet;
