// Paints a preview by WebGPU: the walk along the rays is a compute shader.
import { Color, Matrix4 } from 'three';
import { sumsOf, type Look } from '../volume/looks';
import type { Preview } from '../volume/preview';
import { overShader, walkShader, workgroup } from './live_gpu_shader';
import { sceneFields } from './live_walk';
import {
  crossColour,
  crossOf,
  crossOpacity,
  isSoftwareName,
  placeOfSamples,
  valuesOf,
  type LivePainter,
  type LivePicture,
  type LiveScene,
} from './live_painter';

const sceneFloats = 84;

// Width, height and, of a volume, depth.
type Size = readonly [number, number, number?];

interface Textures {
  samples: GPUTexture;
  blocks: GPUTexture;
}

interface Pipelines {
  walk: GPUComputePipeline;
  enlarge: GPURenderPipeline;
  line: GPURenderPipeline;
}

export class GpuPainter implements LivePainter {
  readonly name = 'webgpu';
  readonly canvas = document.createElement('canvas');
  readonly ready = Promise.resolve();
  onLost: (() => void) | null = null;
  private readonly context: GPUCanvasContext;
  private readonly scene: GPUBuffer;
  private readonly ends: GPUBuffer;
  private readonly smooth: GPUSampler;
  private readonly known = new Map<Preview, Textures>();
  private look: Look | null = null;
  private tables: { look: GPUTexture; sums: GPUTexture };
  private picture: GPUTexture | null = null;
  private isOver = false;

  // Null if the browser has no WebGPU, or fails to make what this needs.
  static async begin(): Promise<GpuPainter | null> {
    try {
      const adapter = await navigator.gpu?.requestAdapter({ powerPreference: 'high-performance' });
      if (!adapter) return null;
      const { architecture, description } = adapter.info;
      const device = await adapter.requestDevice();
      return new GpuPainter(device, await pipelinesOf(device), isSoftwareName(`${architecture} ${description}`));
    } catch (error) {
      console.error('WebGPU cannot draw the preview, WebGL 2 does:', error);
      return null;
    }
  }

  private constructor(
    private readonly device: GPUDevice,
    private readonly pipelines: Pipelines,
    readonly isSoftware: boolean,
  ) {
    const context = this.canvas.getContext('webgpu');
    if (!context) throw new Error('There is no context.');
    this.context = context;
    context.configure({ device, format: navigator.gpu.getPreferredCanvasFormat(), alphaMode: 'premultiplied' });
    this.scene = device.createBuffer({ size: 4 * sceneFloats, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    this.ends = device.createBuffer({ size: 4 * 18, usage: GPUBufferUsage.VERTEX | GPUBufferUsage.COPY_DST });
    this.smooth = device.createSampler({ magFilter: 'linear', minFilter: 'linear' });
    this.tables = this.tablesOf(null);
    void device.lost.then(({ message }) => this.lost(message));
    device.addEventListener('uncapturederror', ({ error }) => this.lost(error.message));
  }

  paint(scene: LiveScene, picture: LivePicture, isOver: () => boolean, then: (isWhole: boolean) => void): void {
    const { wide, high, height, bands } = picture;
    if (this.canvas.width !== wide || this.canvas.height !== high) {
      this.canvas.width = wide;
      this.canvas.height = high;
    }
    if (scene.look !== this.look) this.useLook(scene.look);
    const edge = (band: number): number => Math.floor((height * band) / bands);
    const paintFrom = (band: number): void => {
      if (this.isOver) return;
      if (band > 0 && isOver()) {
        then(false);
        return;
      }
      this.write(scene, picture, [edge(band), edge(band + 1)]);
      const commands = this.device.createCommandEncoder();
      this.walk(commands, scene, picture, edge(band + 1) - edge(band));
      const isLast = band + 1 === bands;
      if (isLast) this.putOver(commands, scene);
      this.device.queue.submit([commands.finish()]);
      this.device.queue.onSubmittedWorkDone().then(
        () => (isLast ? then(true) : paintFrom(band + 1)),
        (error: unknown) => this.lost(String(error)),
      );
    };
    paintFrom(0);
  }

  keep(previews: ReadonlySet<Preview>): void {
    for (const [preview, { samples, blocks }] of this.known) {
      if (previews.has(preview)) continue;
      samples.destroy();
      blocks.destroy();
      this.known.delete(preview);
    }
  }

  dispose(): void {
    this.isOver = true;
    this.context.unconfigure();
    this.device.destroy();
    this.canvas.remove();
  }

  private lost(why: string): void {
    if (this.isOver) return;
    this.isOver = true;
    console.error('WebGPU can no longer draw the preview, WebGL 2 does:', why);
    this.onLost?.();
  }

  // In the order of the shader's structure.
  private write(scene: LiveScene, { width, height }: LivePicture, rows: [number, number]): void {
    const { preview, camera, cursor } = scene;
    const toScreen = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).multiply(placeOfSamples(preview));
    const values = valuesOf(scene);
    const common = sceneFields.flatMap(([name]) => {
      const value = values[name];
      return typeof value === 'number' ? value : value.toArray();
    });
    const floats = [
      ...common,
      cursor ? crossOpacity : 0,
      // As it stands in a style sheet.
      ...new Color(crossColour).convertLinearToSRGB().toArray(),
      1,
      ...toScreen.clone().invert().elements,
      ...toScreen.elements,
      width,
      height,
      ...rows,
    ];
    this.device.queue.writeBuffer(this.scene, 0, Float32Array.from(floats));
  }

  private walk(commands: GPUCommandEncoder, { preview }: LiveScene, { width }: LivePicture, rows: number): void {
    const { samples, blocks } = this.texturesOf(preview);
    const pass = commands.beginComputePass();
    pass.setPipeline(this.pipelines.walk);
    const views = [samples, blocks, this.tables.look, this.tables.sums, this.pictureOfCanvas()].map((texture) => texture.createView());
    pass.setBindGroup(0, this.groupOf(this.pipelines.walk, this.smooth, ...views));
    pass.dispatchWorkgroups(Math.ceil(width / workgroup), Math.ceil(rows / workgroup));
    pass.end();
  }

  private putOver(commands: GPUCommandEncoder, scene: LiveScene): void {
    const { enlarge, line } = this.pipelines;
    const view = this.context.getCurrentTexture().createView();
    const pass = commands.beginRenderPass({ colorAttachments: [{ view, loadOp: 'clear', storeOp: 'store', clearValue: [0, 0, 0, 0] }] });
    pass.setPipeline(enlarge);
    pass.setBindGroup(0, this.groupOf(enlarge, this.smooth, this.pictureOfCanvas().createView()));
    pass.draw(3);
    if (scene.cursor) {
      this.device.queue.writeBuffer(this.ends, 0, crossOf(scene));
      pass.setPipeline(line);
      pass.setBindGroup(0, this.groupOf(line));
      pass.setVertexBuffer(0, this.ends);
      pass.draw(6);
    }
    pass.end();
  }

  // The scene first, then these in their order.
  private groupOf(pipeline: GPUComputePipeline | GPURenderPipeline, ...others: GPUBindingResource[]): GPUBindGroup {
    const resources: GPUBindingResource[] = [{ buffer: this.scene }, ...others];
    return this.device.createBindGroup({
      layout: pipeline.getBindGroupLayout(0),
      entries: resources.map((resource, binding) => ({ binding, resource })),
    });
  }

  private texture(size: Size, format: GPUTextureFormat, usage: GPUTextureUsageFlags, dimension: GPUTextureDimension = '2d'): GPUTexture {
    return this.device.createTexture({ size: size.filter((count) => count !== undefined), format, dimension, usage });
  }

  private filled(bytes: Uint8Array<ArrayBuffer> | Float32Array<ArrayBuffer>, size: Size, format: GPUTextureFormat, bytesPerSample: number): GPUTexture {
    const texture = this.texture(size, format, GPUTextureUsage.TEXTURE_BINDING | GPUTextureUsage.COPY_DST, size.length === 3 ? '3d' : '2d');
    const [width, height, depth = 1] = size;
    this.device.queue.writeTexture({ texture }, bytes, { bytesPerRow: width * bytesPerSample, rowsPerImage: height }, [width, height, depth]);
    return texture;
  }

  private texturesOf(preview: Preview): Textures {
    const found = this.known.get(preview) ?? {
      samples: this.filled(preview.samples, preview.dims, 'r8unorm', 1),
      blocks: this.filled(preview.blocks, preview.blockDims, 'rg8unorm', 2),
    };
    this.known.set(preview, found);
    return found;
  }

  private tablesOf(look: Look | null): { look: GPUTexture; sums: GPUTexture } {
    const given = look ?? { table: new Uint8Array(4 * 256), edges: 0 };
    return { look: this.filled(given.table, [256, 1], 'rgba8unorm', 4), sums: this.filled(sumsOf(given), [257, 1], 'r32float', 4) };
  }

  private useLook(look: Look | null): void {
    this.look = look;
    this.tables.look.destroy();
    this.tables.sums.destroy();
    this.tables = this.tablesOf(look);
  }

  // As large as the canvas; a part of it is painted.
  private pictureOfCanvas(): GPUTexture {
    const { width, height } = this.canvas;
    if (this.picture?.width !== width || this.picture.height !== height) {
      this.picture?.destroy();
      this.picture = this.texture([width, height], 'rgba8unorm', GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.TEXTURE_BINDING);
    }
    return this.picture;
  }
}

async function pipelinesOf(device: GPUDevice): Promise<Pipelines> {
  const walk = device.createShaderModule({ code: walkShader });
  const module = device.createShaderModule({ code: overShader });
  const format = navigator.gpu.getPreferredCanvasFormat();
  const over: GPUBlendComponent = { srcFactor: 'one', dstFactor: 'one-minus-src-alpha' };
  const ends: GPUVertexBufferLayout = { arrayStride: 12, attributes: [{ shaderLocation: 0, offset: 0, format: 'float32x3' }] };
  return {
    walk: await device.createComputePipelineAsync({ layout: 'auto', compute: { module: walk, entryPoint: 'walk' } }),
    enlarge: await device.createRenderPipelineAsync({
      layout: 'auto',
      vertex: { module, entryPoint: 'corner' },
      fragment: { module, entryPoint: 'enlarged', targets: [{ format }] },
    }),
    line: await device.createRenderPipelineAsync({
      layout: 'auto',
      vertex: { module, entryPoint: 'end', buffers: [ends] },
      fragment: { module, entryPoint: 'line', targets: [{ format, blend: { color: over, alpha: over } }] },
      primitive: { topology: 'line-list' },
    }),
  };
}
