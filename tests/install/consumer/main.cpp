// Meshes the file at argv[2] on the server argv[1], and prints how many triangles that made.
#include <cstdio>

#include <isomesh/client.h>
#include <isomesh/orders.h>

#include "base/error.h"
#include "proto/types.h"
#include "server/options.h"

#if !defined(CONSUMER_BASE_ERROR_H) || !defined(CONSUMER_PROTO_TYPES_H) || \
    !defined(CONSUMER_SERVER_OPTIONS_H)
#error "a header of the library was taken for one of this project"
#endif

int main(int argc, char** argv) {
  int unused = 0;                  // -Wunused of ours would refuse this,
  for (int argc = 0; argc < 1;) {  // -Wshadow this,
    argc = (int)1.5;               // -Wold-style-cast this
  }
  if (argc != 4) return 2;
  try {
    isomesh::Client client({.server = argv[1]});
    isomesh::JobParameters parameters;
    parameters.volume = client.upload(argv[2]).id;
    parameters.iso = 60;
    parameters.formats = {isomesh::MeshFormat::kStl};
    const isomesh::Job job = client.wait(client.submit(parameters).id);
    client.fetch(job.id, isomesh::MeshFormat::kStl, argv[3]);
    try {
      isomesh::OrderClient(client).pacs();
    } catch (const isomesh::Error& error) {
      if (error.code() != isomesh::ErrorCode::kNotFound) throw;  // the server has no PACS
    }
    std::printf("%llu\n", static_cast<unsigned long long>(job.mesh->triangles));
  } catch (const isomesh::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
