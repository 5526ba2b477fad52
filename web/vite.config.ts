import react from '@vitejs/plugin-react';
import { defineConfig } from 'vitest/config';

/** The server that the development server passes calls on to. */
const SERVER = process.env['TROUPE_SERVER'] ?? 'http://127.0.0.1:8080';

/** The server answers its own pages alone: it is asked as if the page were its own. */
const proxied = {
  target: SERVER,
  changeOrigin: true,
  ws: true,
  headers: { origin: SERVER },
};

/** What the Rust server says with the page: nothing comes from elsewhere, and only WebAssembly is compiled. */
const POLICY = [
  "default-src 'self'",
  "script-src 'self' 'wasm-unsafe-eval'",
  "style-src 'self' 'unsafe-inline'",
  "img-src 'self' data: blob:",
  "connect-src 'self' blob: data:",
  "worker-src 'self' blob:",
].join('; ');

export default defineConfig({
  plugins: [react()],
  server: {
    host: '127.0.0.1',
    port: 5173,
    strictPort: true,
    // The examples of the repository.
    fs: { allow: ['..'] },
    proxy: { '/v1': proxied, '/metrics': proxied, '/healthz': proxied, '/readyz': proxied },
  },
  // The built page as the server would serve it.
  preview: { host: '127.0.0.1', port: 5173, strictPort: true, headers: { 'content-security-policy': POLICY } },
  build: {
    target: 'es2022',
    sourcemap: false,
    chunkSizeWarningLimit: 2000,
    // Without inlined files all parts are under assets/, with a hash of their content in the name.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  worker: { format: 'es' },
  test: { include: ['src/**/*.test.ts'] },
});
