// Which runs are shown, kept in the page's address: `#run=ID&run=ID&view=ID`.

import { TONES, type Tone } from "./palette";

/** The runs that are shown, each with a tone of its own for as long as it is. */
export class Selection {
  /** Ids by tone; a hole where a run was taken out. */
  private slots: (string | undefined)[] = [];
  /** The run whose robot is shown in 3D, if one was chosen. */
  view: string | null = null;

  static fromAddress(hash: string): Selection {
    const parameters = new URLSearchParams(hash.replace(/^#/, ""));
    const selection = new Selection();
    for (const id of parameters.getAll("run")) selection.add(id);
    selection.view = parameters.get("view");
    return selection;
  }

  toAddress(): string {
    const pairs = this.ids().map((id) => ["run", id]);
    if (this.view !== null) pairs.push(["view", this.view]);
    return pairs.length > 0 ? `#${new URLSearchParams(pairs)}` : "#";
  }

  ids(): string[] {
    return this.slots.filter((id) => id !== undefined);
  }

  has(id: string): boolean {
    return this.slots.includes(id);
  }

  /** Whether one more can be shown. */
  isFull(): boolean {
    return this.ids().length >= TONES.length;
  }

  add(id: string): void {
    if (this.has(id) || this.isFull()) return;
    const free = this.slots.indexOf(undefined);
    this.slots[free < 0 ? this.slots.length : free] = id;
  }

  remove(id: string): void {
    const slot = this.slots.indexOf(id);
    if (slot >= 0) this.slots[slot] = undefined;
    if (this.view === id) this.view = null;
  }

  /** The tone of a run that is shown. */
  tone(id: string): Tone {
    return TONES[Math.max(0, this.slots.indexOf(id))] as Tone;
  }
}
