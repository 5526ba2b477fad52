// The courtyard of the repository's examples, for a server that has no scene yet.
import cup from '../../../examples/objects/cup.toml?raw';
import greeter from '../../../examples/objects/greeter.toml?raw';
import seat from '../../../examples/objects/seat.toml?raw';
import shrine from '../../../examples/objects/shrine.toml?raw';
import sign from '../../../examples/objects/sign.toml?raw';
import courtyard from '../../../examples/scenes/courtyard.toml?raw';

/** Files by name; the scene comes last, because its objects need their definitions. */
export const COURTYARD: readonly (readonly [string, string])[] = [
  ['cup.toml', cup],
  ['greeter.toml', greeter],
  ['seat.toml', seat],
  ['shrine.toml', shrine],
  ['sign.toml', sign],
  ['courtyard.toml', courtyard],
];
