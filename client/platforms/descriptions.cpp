#include "client/platforms/descriptions.h"

#include <algorithm>
#include <cctype>

#include "proto/json_text.h"

namespace isomesh::cli {
namespace {

using Object = nlohmann::ordered_json;

constexpr const char* kWhatItDoes =
    "Makes the surface mesh of a medical volume with isomesh. Not a medical device.";

// "max_error", for languages whose names have no hyphens.
std::string identifier(const ToolOption& option) {
  std::string name = option.name;
  std::ranges::replace(name, '-', '_');
  return name;
}

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

std::string pretty(const Object& object) { return object.dump(2) + '\n'; }

// A literal of Python or Groovy.
std::string quoted(const std::string& text) {
  std::string literal = "'";
  for (const char letter : text) {
    if (letter == '\'' || letter == '\\') literal += '\\';
    literal += letter;
  }
  return literal + '\'';
}

// "'iso', 'labels', ": the names of the options of this kind.
std::string list_of(const ToolTable& table, bool is_flag, std::string (*name)(const ToolOption&)) {
  std::string list;
  std::size_t column = 0;
  for (const ToolOption& option : table.options) {
    if (option.is_flag != is_flag) continue;
    const std::string item = quoted(name(option));
    const bool breaks = column + item.size() > 90;
    list += list.empty() ? "" : breaks ? ",\n    " : ", ";
    column = (breaks ? 0 : column) + item.size() + 2;
    list += item;
  }
  return list;
}

std::string replaced(std::string text,
                     const std::vector<std::pair<std::string, std::string>>& values) {
  for (const auto& [name, value] : values) {
    for (std::size_t at = text.find(name); at != std::string::npos;
         at = text.find(name, at + value.size())) {
      text.replace(at, name.size(), value);
    }
  }
  return text;
}

std::vector<std::pair<std::string, std::string>> values_of(const ToolTable& table) {
  return {{"@WHAT@", kWhatItDoes},
          {"@IMAGE@", quoted(table.image)},
          {"@DOCKER_IMAGE@", quoted("docker://" + table.image)},
          {"@FLAGS@", list_of(table, true, identifier)},
          {"@VALUES@", list_of(table, false, identifier)}};
}

}  // namespace

std::string cwl_of(const ToolTable& table) {
  Object inputs = Object::object();
  inputs["source"] = {{"type", {"File", "Directory"}},
                      {"doc", "A volume: a file, or a folder of DICOM slices or masks"},
                      {"inputBinding", {{"position", 1}}}};
  inputs["output"] = {{"type", "string"},
                      {"default", "mesh.glb"},
                      {"doc", "The mesh; the suffix selects the format"},
                      {"inputBinding", {{"prefix", "--output"}}}};
  for (const ToolOption& option : table.options) {
    const Object binding = {{"prefix", "--" + option.name}};
    Object input = {{"doc", option.help}};
    if (option.is_flag) {
      input["type"] = "boolean?";
      input["inputBinding"] = binding;
    } else if (option.is_repeated) {
      input["type"] = {"null", {{"type", "array"}, {"items", "string"}, {"inputBinding", binding}}};
      // Without it the items are not on the command line.
      input["inputBinding"] = Object::object();
    } else {
      input["type"] = "string?";
      input["inputBinding"] = binding;
    }
    inputs[identifier(option)] = std::move(input);
  }
  return pretty({{"cwlVersion", "v1.2"},
                 {"class", "CommandLineTool"},
                 {"label", "isomesh"},
                 {"doc", kWhatItDoes},
                 {"hints", {{"DockerRequirement", {{"dockerPull", table.image}}}}},
                 {"baseCommand", {"isomesh", "local"}},
                 {"inputs", inputs},
                 {"outputs",
                  {{"mesh", {{"type", "File"}, {"outputBinding", {{"glob", "$(inputs.output)"}}}}},
                   {"materials",
                    {{"type", "File?"},
                     {"doc", "The colours of the labels, which an OBJ names"},
                     {"outputBinding", {{"glob", "*.mtl"}}}}}}}});
}

std::string xnat_of(const ToolTable& table) {
  Object inputs = Object::array();
  std::string line = "isomesh local /input --output /output/#OUTPUT#";
  inputs.push_back({{"name", "output"},
                    {"description", "The mesh; the suffix selects the format"},
                    {"type", "string"},
                    {"default-value", "mesh.glb"},
                    {"required", true},
                    {"replacement-key", "#OUTPUT#"}});
  for (const ToolOption& option : table.options) {
    const std::string key = '#' + upper(identifier(option)) + '#';
    line += ' ' + key;
    Object input = {{"name", option.name}, {"description", option.help}};
    if (option.is_flag) {
      input["type"] = "boolean";
      input["default-value"] = "false";
      input["true-value"] = "--" + option.name;
      input["false-value"] = "";
    } else {
      input["type"] = "string";
      input["command-line-flag"] = "--" + option.name;
    }
    input["required"] = false;
    input["replacement-key"] = key;
    inputs.push_back(std::move(input));
  }
  const Object in = {{"name", "in"}, {"writable", false}, {"path", "/input"}};
  const Object out = {{"name", "out"}, {"writable", true}, {"path", "/output"}};
  const Object scan = {{"name", "scan"},
                       {"description", "The scan to mesh"},
                       {"type", "Scan"},
                       {"required", true},
                       {"matcher", "'DICOM' in @.resources[*].label"}};
  const Object resource = {{"name", "dicom"},
                           {"type", "Resource"},
                           {"required", true},
                           {"matcher", "@.label == 'DICOM'"},
                           {"derived-from-wrapper-input", "scan"},
                           {"provides-files-for-command-mount", "in"}};
  const Object handler = {{"name", "mesh-resource"},
                          {"accepts-command-output", "mesh"},
                          {"as-a-child-of", "scan"},
                          {"type", "Resource"},
                          {"label", "MESH"}};
  return pretty(
      {{"name", "isomesh"},
       {"label", "isomesh"},
       {"description", kWhatItDoes},
       {"version", ISOMESH_VERSION},
       {"schema-version", "1.0"},
       {"type", "docker"},
       {"image", table.image},
       {"override-entrypoint", true},
       {"command-line", line},
       {"mounts", {in, out}},
       {"inputs", inputs},
       {"outputs",
        {{{"name", "mesh"}, {"description", "The mesh"}, {"required", true}, {"mount", "out"}}}},
       {"xnat",
        {{{"name", "isomesh-scan"},
          {"label", "Mesh with isomesh"},
          {"description", kWhatItDoes},
          {"contexts", {"xnat:imageScanData"}},
          {"external-inputs", Object::array({scan})},
          {"derived-inputs", Object::array({resource})},
          {"output-handlers", Object::array({handler})}}}}});
}

std::string snakemake_of(const ToolTable& table) {
  return replaced(R"('''@WHAT@

config["volumes"] maps names to files or folders; all other entries are options of `isomesh local`:

    snakemake --cores 1 --config volumes='{head: head.nii.gz}' iso=otsu triangles=100000
'''
import shlex

FLAGS = [@FLAGS@]
VALUES = [@VALUES@]


def options_of(config):
    words = []
    for name, value in config.items():
        if name in FLAGS:
            if str(value).lower() not in ("true", "false"):
                raise ValueError(f"{name} is true or false, not {value}")
            words += [f"--{name.replace('_', '-')}"] if str(value).lower() == "true" else []
        elif name in VALUES:
            for each in value if isinstance(value, list) else [value]:
                words += [f"--{name.replace('_', '-')}={each}"]
        elif name not in ("volumes", "suffix"):
            raise ValueError(f"isomesh local has no option {name}")
    return shlex.join(words)


rule all:
    input: expand("meshes/{name}.{suffix}", name=config["volumes"], suffix=config.get("suffix", "glb"))


rule isomesh:
    input: lambda wildcards: config["volumes"][wildcards.name]
    output: "meshes/{name}.{suffix}"
    params: options=options_of(config)
    container: @DOCKER_IMAGE@
    shell: "isomesh local {input:q} {params.options} -o {output:q}"
)",
                  values_of(table));
}

// In the strict syntax, which Nextflow 26.04 requires: declarations only, and no statements beside
// them.
std::string nextflow_of(const ToolTable& table) {
  return replaced(R"(// @WHAT@
// nextflow run isomesh.nf --volumes 'scans/*.nii.gz' --iso otsu --triangles 100000
// All parameters but `volumes`, `suffix` and `outdir` are options of `isomesh local`.

params.volumes = null
params.suffix = 'glb'
params.outdir = 'meshes'

def quoted(text) {
    return "'" + text.toString().replace("'", "'\\''") + "'"
}

// Nextflow makes `maxError` of `--max-error`.
def option_of(name) {
    return name.replaceAll('([a-z])([A-Z])', '$1_$2').toLowerCase().replace('-', '_')
}

def options_of(given) {
    def flags = [@FLAGS@]
    def values = [@VALUES@]
    def options = given.collectEntries { name, value -> [(option_of(name)): value] }
    def words = options.collectMany { name, value ->
        def option = '--' + name.replace('_', '-')
        if (value == null || name in ['volumes', 'suffix', 'outdir']) {
            return []
        }
        if (name in flags && value.toString() in ['true', 'false']) {
            return value.toString() == 'true' ? [option] : []
        }
        if (name in values) {
            return [value].flatten().collect { each -> quoted("${option}=${each}") }
        }
        error(name in flags ? "${option} is true or false, not ${value}" : "isomesh local has no option ${option}")
    }
    return words.join(' ')
}

// "sub-01.T1" for "sub-01.T1.nii.gz"
def name_of(volume) {
    if (volume.isDirectory()) {
        return volume.name
    }
    return volume.name.replaceFirst('(?i)\\.(gz|bz2|xz)$', '').replaceFirst('(?<=.)\\.[^.]*$', '')
}

process ISOMESH {
    container @IMAGE@
    publishDir params.outdir, mode: 'copy'

    input:
    tuple val(name), path(volume)
    val options
    val suffix

    output:
    path "${name}.${suffix}", glob: false, emit: mesh
    path "*.mtl", optional: true, emit: materials

    script:
    """
    isomesh local ${volume} ${options} -o ${quoted(name + '.' + suffix)}
    """
}

workflow {
    if (!params.volumes) {
        error("give --volumes 'scans/*.nii.gz'")
    }
    def volumes = channel.fromPath(params.volumes, type: 'any', checkIfExists: true)
        .map { volume -> tuple(name_of(volume), volume) }
        .groupTuple()
        .map { name, found ->
            if (found.size() > 1) {
                error("${found.join(' and ')} would both become ${name}.${params.suffix}")
            }
            return tuple(name, found[0])
        }
    ISOMESH(volumes, options_of(params), params.suffix)
}
)",
                  values_of(table));
}

std::string bids_of(const ToolTable& table) {
  return replaced(R"(#!/usr/bin/env python3
"""@WHAT@

A BIDS App: isomesh_bids.py BIDS_DIR OUTPUT_DIR participant [--participant-label 01 02] [--image T1w] [options of `isomesh local`]
"""
import argparse
import json
import pathlib
import subprocess
import sys

FLAGS = [@FLAGS@]
VALUES = [@VALUES@]

parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
parser.add_argument("bids_dir", type=pathlib.Path)
parser.add_argument("output_dir", type=pathlib.Path)
parser.add_argument("analysis_level", choices=["participant"])
parser.add_argument("--participant-label", nargs="+", help="subjects, with or without 'sub-'; all if left out")
parser.add_argument("--image", default="T1w", help="the suffix of the images to mesh, or of masks")
parser.add_argument("--suffix", default="glb", help="the format of the meshes")
for name in FLAGS:
    parser.add_argument("--" + name.replace("_", "-"), action="store_true")
for name in VALUES:
    parser.add_argument("--" + name.replace("_", "-"), action="append")
arguments = []
rest = iter(sys.argv[1:])
for word in rest:
    # Joined: argparse takes a value that begins with a minus, such as that of --crop, for an option.
    value = next(rest, None) if word[:2] == "--" and word[2:].replace("-", "_") in VALUES else None
    arguments.append(word if value is None else f"{word}={value}")
given = vars(parser.parse_args(arguments))

words = ["--" + name.replace("_", "-") for name in FLAGS if given[name]]
for name in VALUES:
    words += [f"--{name.replace('_', '-')}={value}" for value in given[name] or []]
subjects = {path.name.removeprefix("sub-"): path for path in sorted(given["bids_dir"].glob("sub-*"))}
wanted = [label.removeprefix("sub-") for label in given["participant_label"] or subjects]
if unknown := [label for label in wanted if label not in subjects]:
    sys.exit(f"no subject {', '.join(unknown)} in {given['bids_dir']}")
images = {}
for label in dict.fromkeys(wanted):
    for image in sorted(subjects[label].rglob(f"*_{given['image']}.nii*")):
        if image.name.endswith((".nii", ".nii.gz")):
            stem = image.name.removesuffix(".gz").removesuffix(".nii")
            mesh = image.relative_to(given["bids_dir"]).with_name(f"{stem}_mesh.{given['suffix']}")
            if mesh in images:
                sys.exit(f"{images[mesh]} and {image} would both become {mesh}")
            images[mesh] = image
if not images:
    sys.exit(f"no image *_{given['image']}.nii* of the wanted subjects in {given['bids_dir']}")
output = given["output_dir"]
output.mkdir(parents=True, exist_ok=True)
description = output / "dataset_description.json"
if not description.exists():
    generator = {"Name": "isomesh", "Container": {"Type": "docker", "Tag": @IMAGE@}}
    dataset = {"Name": "Surface meshes", "BIDSVersion": "1.9.0", "DatasetType": "derivative", "GeneratedBy": [generator]}
    description.write_text(json.dumps(dataset, indent=2))
failed = 0
for mesh, image in images.items():
    (output / mesh).parent.mkdir(parents=True, exist_ok=True)
    failed += subprocess.run(["isomesh", "local", image, *words, "-o", output / mesh]).returncode != 0
sys.exit(1 if failed else 0)
)",
                  values_of(table));
}

}  // namespace isomesh::cli
