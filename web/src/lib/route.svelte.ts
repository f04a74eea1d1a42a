// Where the page is: `#/job/ID` and the like, so that an address can be kept,
// sent and opened again, whatever path the service is served below.

export type Route =
  | { name: "start" }
  | { name: "page"; id: string }
  | { name: "sheet"; id: string }
  | { name: "job"; id: string }
  | { name: "compare"; id: string; other: string };

const ID = "([0-9a-f-]{36})";

/** Reads a hash; what is none of ours is the start. */
export function parseRoute(hash: string): Route {
  const one = new RegExp(`^#/(page|sheet|job)/${ID}$`).exec(hash);
  if (one) return { name: one[1] as "page" | "sheet" | "job", id: one[2] ?? "" };
  const two = new RegExp(`^#/compare/${ID}/${ID}$`).exec(hash);
  if (two) return { name: "compare", id: two[1] ?? "", other: two[2] ?? "" };
  return { name: "start" };
}

/** The hash of a route. */
export function href(route: Route): string {
  if (route.name === "start") return "#/";
  const other = route.name === "compare" ? `/${route.other}` : "";
  return `#/${route.name}/${route.id}${other}`;
}

class Here {
  route = $state<Route>(parseRoute(location.hash));

  constructor() {
    addEventListener("hashchange", () => {
      this.route = parseRoute(location.hash);
    });
  }
}

export const here = new Here();

export function go(route: Route): void {
  location.hash = href(route);
}
