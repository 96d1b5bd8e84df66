// One tone for each run that is shown, the same everywhere; told apart by colour-blind readers, by dashes too.

export interface Tone {
  light: string;
  dark: string;
  dash: number[];
}

/** After Okabe and Ito 2008, moved in lightness for contrast: the tones of the reports. */
export const TONES: readonly Tone[] = [
  { light: "#0072b2", dark: "#5db5f0", dash: [] },
  { light: "#d55e00", dark: "#ff9256", dash: [7, 2, 2, 2] },
  { light: "#009e73", dark: "#3fcaa0", dash: [14, 3] },
  { light: "#7a5cc0", dark: "#b8a0f5", dash: [5, 2] },
  { light: "#cc79a7", dark: "#eda3c9", dash: [2, 3] },
  { light: "#2a9fc4", dark: "#74d0ec", dash: [3, 2] },
  { light: "#7f8c00", dark: "#c3d04e", dash: [9, 3] },
  { light: "#e09f00", dark: "#f2b73a", dash: [1, 3] },
];

/** Of gaits that were not learned. */
export const DEFAULT_TONES: readonly Tone[] = [
  { light: "#6b7280", dark: "#a8b0bd", dash: [] },
  { light: "#a08a5b", dark: "#cdb98f", dash: [6, 3] },
  { light: "#3f4650", dark: "#747d89", dash: [] },
  { light: "#7d5240", dark: "#b98f7c", dash: [] },
];

const darkScheme = window.matchMedia("(prefers-color-scheme: dark)");

export function isDark(): boolean {
  return darkScheme.matches;
}

/** The tone's colour on the ground that the page has now. */
export function colour(tone: Tone): string {
  return isDark() ? tone.dark : tone.light;
}

export function onSchemeChange(act: () => void): void {
  darkScheme.addEventListener("change", act);
}
