// explore SERVER VOLUME OUT.glb: finds an iso-value whose surface has at most a million triangles,
// and then requests the mesh. The search begins with the iso-value that the server suggests.
#include <cstdio>
#include <string>

#include <isomesh/client.h>

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "Usage: explore SERVER VOLUME OUT.glb\n");
    return 2;
  }
  try {
    isomesh::Client client({.server = argv[1]});
    const isomesh::Volume volume = client.upload(argv[2]);
    std::printf("%s: %u x %u x %u, values from %g to %g\n", volume.name.value_or("?").c_str(),
                volume.dims[0], volume.dims[1], volume.dims[2], volume.range[0], volume.range[1]);

    // Estimates are exact, and need a fraction of a job's time.
    isomesh::JobParameters parameters;
    parameters.volume = volume.id;
    parameters.formats = {isomesh::MeshFormat::kGlb};
    constexpr std::uint64_t kMost = 1'000'000;
    double iso = volume.suggested_iso;
    isomesh::Estimate estimate;
    for (int tries = 0; tries < 12; ++tries) {
      parameters.iso = iso;
      estimate = client.estimate(parameters);
      std::printf("at %g: %llu triangles\n", iso,
                  static_cast<unsigned long long>(estimate.triangles));
      if (estimate.triangles <= kMost) break;
      iso = (iso + volume.range[1]) / 2;
    }
    if (estimate.triangles > kMost) {
      std::fprintf(stderr, "no surface with at most %llu triangles was found\n",
                   static_cast<unsigned long long>(kMost));
      return 1;
    }

    const isomesh::Job job = client.wait(client.submit(parameters).id, [](const isomesh::Job& now) {
      std::printf("%3.0f %%\n", 100 * now.progress);
    });
    if (job.mesh && job.mesh->empty) {
      std::fprintf(stderr, "the surface is empty: %s\n",
                   job.mesh->empty_reason.value_or("").c_str());
      return 1;
    }
    client.fetch(job.id, isomesh::MeshFormat::kGlb, argv[3]);
    std::printf("%s: %llu triangles, %.0f mm2\n", argv[3],
                static_cast<unsigned long long>(job.mesh->triangles), job.mesh->area_mm2);
  } catch (const isomesh::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
