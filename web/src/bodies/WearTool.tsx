import { FileButton } from '@mantine/core';
import { Shirt } from 'lucide-react';
import { Tool } from '../app/Tool';
import { CHARACTERS, useWardrobe } from './wardrobe';

/** Chooses a file of a character that the selected character's body is to wear. */
export function WearTool({ onFile }: { onFile: (file: File) => void }) {
  const isOn = useWardrobe(({ outfits }) => outfits.some(({ state }) => state === 'worn'));
  return (
    <FileButton
      accept={CHARACTERS}
      onChange={(file) => {
        if (file) onFile(file);
      }}
    >
      {({ onClick }) => (
        <Tool label="Wear a character of your own: glb or vrm" icon={Shirt} isOn={isOn} onClick={onClick} />
      )}
    </FileButton>
  );
}
