// isomesh-openapi FILE: updates the generated parts of openapi.yaml.
#include <exception>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

#include "proto/openapi/describe.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "Usage: isomesh-openapi FILE\n";
    return 2;
  }
  try {
    std::ifstream input(argv[1], std::ios::binary);
    const std::string before{std::istreambuf_iterator<char>(input), {}};
    const std::string after = isomesh::with_parameters(before);
    if (after == before) return 0;
    std::ofstream output(argv[1], std::ios::binary);
    output << after << std::flush;
    if (!output) throw std::runtime_error("the file cannot be written");
    return 0;
  } catch (const std::exception& error) {
    std::cerr << argv[1] << ": " << error.what() << '\n';
    return 1;
  }
}
