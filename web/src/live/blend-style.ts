// A style that blends words.

/** Most words of a style. */
export const MOST_WORDS = 8;

/** Shares become weights, at most 1 in all. The name says what is in it, so that equal blends are one style. */
export function blendStyle(parts: readonly { word: string; share: number }[], speed: number) {
  const used = parts.filter((part) => part.share > 0);
  const sum = Math.max(
    1,
    used.reduce((total, part) => total + part.share, 0),
  );
  const words = used.map(({ word, share }) => ({ word, weight: Math.floor((share / sum) * 100) / 100 }));
  const name = `blend-${words.map(({ word, weight }) => `${word}${Math.round(weight * 100)}`).join('-')}`;
  return {
    name: name.replace(/[^\w.-]/g, '').slice(0, 64),
    style: { default_speed: speed, replan_interval_frames: 15, words },
  };
}
