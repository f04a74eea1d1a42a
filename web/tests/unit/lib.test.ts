import { zipSync } from "fflate";
import { describe, expect, it } from "vitest";
import { EventReader } from "../../src/api/sse";
import { azimuthOfName, guessAzimuths, nearestNamed, otherWay, turned } from "../../src/lib/azimuth";
import { moved, resized } from "../../src/lib/boxes";
import { curl, python } from "../../src/lib/commands";
import { filesOfSheet, sortFiles, unpacked } from "../../src/lib/drop";
import { type Schema, changed, groupsOf, valuesOf } from "../../src/lib/options";
import { readPfm, turbo } from "../../src/lib/pfm";
import { gradeOf, percent, verdict } from "../../src/lib/plain";
import { planeName, viewpointName, viewpointWords } from "../../src/lib/viewpoint";

const file = (name: string, content = "x") => new File([content], name);

describe("angles", () => {
  it("stay within a turn", () => {
    expect([-90, 360, 725.5, -0].map(turned)).toEqual([270, 0, 5.5, 0]);
    expect([22, 23, 359].map(nearestNamed)).toEqual([0, 45, 0]);
    expect([45, 180, 0].map(otherWay)).toEqual([315, 180, 0]);
  });

  it("are told by names of files", () => {
    const told = ["view_045.png", "front.png", "hero-3-4.png", "back_3-4.jpg", "Rear.png", "side R 270.webp"];
    expect(told.map(azimuthOfName)).toEqual([45, 0, 45, 135, 180, 90]);
    expect(azimuthOfName("drawing.png")).toBeNull();
    expect(azimuthOfName("view_22.5.png")).toBe(22.5);
  });

  it("are spread where names tell none or the same", () => {
    expect(guessAzimuths(["a.png", "b.png"])).toEqual([0, 90]);
    expect(guessAzimuths(["front.png", "front2.png", "front3.png"])).toEqual([0, 45, 90]);
    expect(guessAzimuths(["v_090.png", "v_000.png"])).toEqual([90, 0]);
    expect(guessAzimuths(Array.from({ length: 8 }, (_, k) => `p${"x".repeat(k)}.png`))).toHaveLength(8);
  });
});

describe("what is dropped", () => {
  it("is sorted by kind", () => {
    expect(sortFiles([file("sheet.png")]).kind).toBe("page");
    // A vector drawing is a picture too.
    expect(sortFiles([file("sheet.svg")]).kind).toBe("page");
    expect(sortFiles([file("b10.png"), file("b2.png"), file("notes.txt")])).toMatchObject({
      kind: "views",
      files: [{ name: "b2.png" }, { name: "b10.png" }],
    });
    expect(sortFiles([file("a.GLB")]).kind).toBe("model");
    expect(sortFiles([file("sheet.json"), file("a.png"), file("m.obj")]).kind).toBe("sheet");
    expect(sortFiles([])).toMatchObject({ kind: "nothing", why: "empty" });
    expect(sortFiles([file("a.obj"), file("b.obj")])).toMatchObject({ why: "models" });
    expect(sortFiles([file("a.txt"), file(".hidden.png")])).toMatchObject({ why: "unknown" });
  });

  it("is unpacked", async () => {
    const bytes = new TextEncoder().encode("drawing");
    const zip = zipSync({ "a/sheet.json": bytes, "a/v.png": bytes, "__MACOSX/v.png": bytes, "x.exe": bytes });
    const files = await unpacked([new File([new Uint8Array(zip)], "s.zip"), file("b.png")]);
    expect(files.map((one) => one.name)).toEqual(["sheet.json", "v.png", "b.png"]);
    expect(await files[1]?.text()).toBe("drawing");
    await expect(unpacked([file("broken.zip", "no archive")])).rejects.toThrow();
  });

  it("is only what the sheet names", () => {
    const sheet = { views: [{ image: "f/a.png", mask: "m.png" }], truth: { model: "t.obj" } };
    const files = ["a.png", "m.png", "t.obj", "page.png"].map((name) => file(name));
    expect(filesOfSheet(sheet, files).map((one) => one.name)).toEqual(["a.png", "m.png", "t.obj"]);
  });
});

describe("options", () => {
  const schema: Schema = {
    properties: {
      method: {
        oneOf: [
          { const: "a", description: "First." },
          { const: "b" },
        ],
        default: "a",
        description: "How\nit is done.",
      },
      depth: {
        properties: {
          max_error_px: { type: "number", minimum: 0, maximum: 9, default: 2 },
          ratio: { anyOf: [{ type: "number", maximum: 1 }, { type: "null" }], default: null },
          deep: { $ref: "#/$defs/Deep" },
        },
        default: { max_error_px: 3, ratio: null },
      },
    },
    $defs: { Deep: { properties: { on: { type: "boolean", default: true } }, description: "Deeper." } },
  };

  it("become groups of fields with their ranges and defaults", () => {
    const groups = groupsOf(schema);
    expect(groups.map((group) => group.name)).toEqual(["", "depth", "depth.deep"]);
    expect(groups[0]?.fields[0]).toMatchObject({
      kind: "choice",
      help: "How it is done.",
      choices: [{ value: "a", help: "First." }, { value: "b" }],
    });
    const [error, ratio] = groups[1]?.fields ?? [];
    expect(error).toMatchObject({ label: "Max error", unit: "px", min: 0, max: 9, initial: 3 });
    expect(ratio).toMatchObject({ kind: "number", optional: true, initial: null, max: 1 });
    expect(groups[2]?.fields[0]).toMatchObject({ name: "depth.deep.on", kind: "boolean", initial: true });
  });

  it("send what differs, and take it back", () => {
    const groups = groupsOf(schema);
    const values = { method: "a", "depth.ratio": 0.7, "depth.deep.on": false };
    const options = changed(groups, values);
    expect(options).toEqual({ depth: { ratio: 0.7, deep: { on: false } } });
    expect(valuesOf(groups, { method: "a", ...options })).toEqual({
      "depth.ratio": 0.7,
      "depth.deep.on": false,
    });
  });
});

describe("events", () => {
  it("are read in pieces of any size", () => {
    const sent = "id: 1\nevent: queued\ndata: {}\n\n: alive\n\nid: 2\r\nevent: progress\r\ndata: a\r\ndata: b\r\n\r\nid: 3\n";
    for (const size of [1, 7, 1000]) {
      const reader = new EventReader();
      const events = [];
      for (let at = 0; at < sent.length; at += size) events.push(...reader.push(sent.slice(at, at + size)));
      expect(events).toEqual([
        { id: "1", event: "queued", data: "{}" },
        { id: "2", event: "progress", data: "a\nb" },
      ]);
    }
  });
});

describe("boxes", () => {
  const box = { left: 10, top: 20, right: 50, bottom: 90 };
  it("stay on the picture and hold a figure", () => {
    expect(moved(box, -30, 5.4, 100, 100)).toEqual({ left: 0, top: 25, right: 40, bottom: 95 });
    expect(moved(box, 300, 300, 100, 100)).toEqual({ left: 60, top: 30, right: 100, bottom: 100 });
    expect(resized(box, "nw", 100, -100, 100, 100)).toEqual({ left: 34, top: 0, right: 50, bottom: 90 });
    expect(resized(box, "se", 500, -500, 100, 100)).toEqual({ left: 10, top: 20, right: 100, bottom: 36 });
  });
});

describe("commands", () => {
  const made = {
    form: [["page", "ID"] as [string, string], ["view[0]", "@it's a.png"] as [string, string]],
    options: { seed: 7, turntable: { solid: { prior: "off" } } },
    model: "solid.glb",
  };
  it("say the same to a shell and to Python", () => {
    expect(curl(made, "http://x/sub/", true)).toBe(
      [
        "curl -i",
        '-H "Authorization: Bearer $TURNAROUND_KEY"',
        "-F page=ID",
        "-F 'view[0]=@it'\\''s a.png'",
        "-F seed=7",
        "-F turntable.solid.prior=off",
        "http://x/sub/v1/reconstructions",
      ].join(" \\\n  "),
    );
    const code = python(made, "http://x/", false);
    expect(code).toContain('("view[0]", open("it\'s a.png", "rb"))');
    expect(code).toContain('("turntable.solid.prior", (None, "off"))');
    expect(code).not.toContain("KEY");
    expect(code).toContain("/artifacts/solid.glb");
    // Each method's own model.
    expect(python({ ...made, model: "hull.glb" }, "http://x/", false)).toContain("/artifacts/hull.glb");
  });
});

describe("maps", () => {
  it("are read from below", () => {
    const head = new TextEncoder().encode("Pf\n2 2\n-1.0\n");
    const bytes = new Uint8Array(head.length + 16);
    bytes.set(head);
    const view = new DataView(bytes.buffer, head.length);
    [1, 2, NaN, 4].forEach((value, k) => view.setFloat32(k * 4, value, true));
    const map = readPfm(bytes.buffer);
    expect([...map.values]).toEqual([NaN, 4, 1, 2]);
    expect([map.min, map.max]).toEqual([1, 4]);
    expect(() => readPfm(bytes.buffer.slice(0, 20))).toThrow("early");
    expect(() => readPfm(new TextEncoder().encode("P6 1 1 255 x").buffer as ArrayBuffer)).toThrow("PFM");
    expect([turbo(0), turbo(1), turbo(-3)]).toEqual([[48, 18, 59], [122, 4, 3], [48, 18, 59]]);
  });
});

describe("plain words", () => {
  const fit = (azimuth: number, overlap: number) => ({ view: { azimuth, elevation: 0 }, overlap, grade: gradeOf(overlap), words: "" });
  it("name the views that disagree first", () => {
    expect(verdict([fit(0, 0.99), fit(45, 0.7), fit(90, 0.9)])).toMatchObject({
      grade: "poor",
      words: expect.stringContaining("45°") as string,
    });
    expect(verdict([fit(0, 0.99), fit(90, 0.9)])?.words).toContain("90°");
    expect(verdict([fit(0, 0.99)])?.grade).toBe("good");
    expect(verdict([])).toBeNull();
    expect([0.999, 1, 0.123].map(percent)).toEqual(["99 %", "100 %", "12 %"]);
  });

  it("name views as files and planes do, and as people read them", () => {
    const view = (azimuth: number, elevation = 0) => ({ azimuth, elevation });
    const planes = [view(0), view(45), view(22.5), view(0, 90), view(315, -30.5)].map(planeName);
    expect(planes).toEqual(["ref_000", "ref_045", "ref_0225", "ref_000_e90", "ref_315_e-305"]);
    expect([view(-45), view(22.5, -30)].map(viewpointName)).toEqual(["315", "22.5_e-30"]);
    expect([view(45), view(0, 90)].map(viewpointWords)).toEqual(["45°", "0° raised 90°"]);
  });
});
