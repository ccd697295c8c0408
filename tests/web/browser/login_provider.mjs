// A login provider (oidc-provider of npm) on a free port of loopback, for whoever starts it. Writes its address, then runs until
// it is ended.
import { generateKeyPairSync } from 'node:crypto';
import { createServer } from 'node:http';

const modules = new URL('../../../client/web/node_modules/', import.meta.url);
const { default: Provider } = await import(new URL('oidc-provider/lib/index.js', modules).href);

function newKey(kind, options, more) {
  return { ...generateKeyPairSync(kind, options).privateKey.export({ format: 'jwk' }), use: 'sig', ...more };
}

const keys = [
  newKey('rsa', { modulusLength: 2048 }, { kid: 'rsa', alg: 'RS256' }),
  newKey('ec', { namedCurve: 'P-256' }, { kid: 'curve', alg: 'ES256' }),
];

const client = {
  token_endpoint_auth_method: 'none',
  redirect_uris: ['http://127.0.0.1/'], // of any port: a native application's
  application_type: 'native',
  grant_types: ['authorization_code'],
  response_types: ['code'],
};

const configuration = {
  clients: [
    { ...client, client_id: 'isomesh-page' },
    { ...client, client_id: 'isomesh-page-by-id-token', id_token_signed_response_alg: 'ES256' },
  ],
  clientBasedCORS: () => true,
  jwks: { keys },
  cookies: { keys: ['of a test'] },
  findAccount: (_, id) => ({ accountId: id, claims: () => ({ sub: id }) }),
  // What a hospital's provider tells about people.
  extraTokenClaims: (_, { accountId }) => ({ roles: [accountId === 'visitor' ? 'visitors' : 'isomesh-user'] }),
  features: {
    resourceIndicators: {
      enabled: true,
      useGrantedResource: () => true,
      getResourceServerInfo: () => ({ scope: '', audience: 'isomesh', accessTokenFormat: 'jwt', jwt: { sign: { alg: 'ES256' } } }),
    },
  },
};

const server = createServer((request, response) => answer(request, response));
let answer;
server.listen(0, '127.0.0.1', () => {
  const issuer = `http://127.0.0.1:${server.address().port}`;
  answer = new Provider(issuer, configuration).callback();
  process.stdout.write(`${issuer}\n`);
});
