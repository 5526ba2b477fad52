// The look of bodies: one material for capsules and skins, which differ in how vertices come about.
import { MeshDepthMaterial, MeshStandardMaterial, RGBADepthPacking, type IUniform } from 'three';
import type { Texture } from 'three';

/** Brightness where a surface turns away from the eye; shared by all bodies, set by the theme. */
export type EdgeUniform = IUniform<number>;

export interface BodyMaterials {
  lit: MeshStandardMaterial;
  /** Shared by all of them. */
  uniforms: Record<string, IUniform<Texture | null>>;
  /** For the shadow map. */
  depth: MeshDepthMaterial;
  /** Finds the nearest surface and draws nothing: for bodies that are seen through. */
  ghostDepth(): MeshStandardMaterial;
  dispose(): void;
}

/**
 * Materials whose vertices come from `void bodyVertex(out vec3 place, out vec3 direction)` in `declare`, which also sets
 * `varying vec4 vColour`. A `base` material keeps its own maps and colours.
 */
export function bodyMaterials(
  declare: string,
  edge: EdgeUniform,
  uniforms: Record<string, IUniform<Texture | null>>,
  base?: MeshStandardMaterial,
): BodyMaterials {
  const make = (): MeshStandardMaterial => {
    const material = base?.clone() ?? new MeshStandardMaterial({ roughness: 0.62, metalness: 0 });
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, uniforms, { uEdge: edge });
      shader.vertexShader = `${declare}\n${shader.vertexShader}`
        .replace('#include <beginnormal_vertex>', 'vec3 bodyPlace, objectNormal;\nbodyVertex(bodyPlace, objectNormal);')
        .replace('#include <begin_vertex>', 'vec3 transformed = bodyPlace;');
      shader.fragmentShader = `uniform float uEdge;\nvarying vec4 vColour;\n${shader.fragmentShader}`
        .replace('#include <color_fragment>', '#include <color_fragment>\ndiffuseColor *= vColour;')
        .replace(
          '#include <opaque_fragment>',
          `float facing = abs(dot(normalize(normal), normalize(vViewPosition)));
           outgoingLight *= mix(uEdge, 1.0, smoothstep(0.0, 0.45, facing));
           #include <opaque_fragment>`,
        );
    };
    // The vertex code decides which programs may be shared.
    material.customProgramCacheKey = () => declare;
    return material;
  };
  const lit = make();
  const made = [lit];
  const depth = new MeshDepthMaterial({ depthPacking: RGBADepthPacking });
  depth.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = `${declare}\n${shader.vertexShader}`.replace(
      '#include <begin_vertex>',
      'vec3 transformed, bodyDirection;\nbodyVertex(transformed, bodyDirection);',
    );
  };
  depth.customProgramCacheKey = () => declare;
  return {
    lit,
    uniforms,
    depth,
    ghostDepth() {
      const material = make();
      material.colorWrite = false;
      made.push(material);
      return material;
    },
    dispose() {
      for (const material of made) material.dispose();
      depth.dispose();
    },
  };
}
