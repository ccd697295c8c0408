// Stands in for Nextflow, which Debian lacks: runs a script with one process as its documentation says, on this machine.
//   groovy nextflow.groovy SCRIPT [--NAME VALUE]..

class Failure extends RuntimeException {
    Failure(String text) { super(text) }
}

// A file as a process sees it: under its own name, with a backslash before what a shell takes for more than a letter.
class Staged {
    File file
    String toString() { file.name.replaceAll(/['" ()\\!&|<>`:]/) { '\\' + it } }
}

class Glob {
    static List<File> files(File folder, String pattern) {
        def whole = new File(folder, pattern).absoluteFile
        if (!(pattern =~ /[*?\[{]/)) return whole.exists() ? [whole] : []
        def found = []
        java.nio.file.Files.newDirectoryStream(whole.parentFile.toPath(), whole.name).withCloseable { it.each { found << it.toFile() } }
        found.sort()
    }
}

class Items {
    List all
    Items map(Closure made) { new Items(all: all.collect(made)) }
    Items groupTuple() { new Items(all: all.groupBy { it[0] }.collect { name, found -> [name, found.collect { it[1] }] }) }
}

// What the names in a process mean while a task of it is declared.
class Task {
    Map values
    List files = []
    List outputs = []
    String folder
    def container(image) {}
    def publishDir(Map how, where) { folder = where }
    def val(value) { value }
    def tuple(Object... parts) { parts as List }
    def path(Staged file) { files << file; file }
    def path(Map how, name) { outputs << [name.toString(), how] }
    def propertyMissing(String name) { values[name] }
}

abstract class Pipeline extends Script {
    Closure declared
    List inputs = []
    final channel = this

    def process(ignored) {}
    def tuple(Object... parts) { parts as List }
    def error(text) { throw new Failure(text) }
    def workflow(Closure body) { body() }

    Items fromPath(Map how, pattern) {
        def found = Glob.files(new File('.'), pattern).findAll { it.isFile() || how.type == 'any' }
        if (!found && how.checkIfExists) error("No files match pattern `$pattern`")
        new Items(all: found)
    }

    def methodMissing(String name, arguments) {
        if (arguments.length == 1 && arguments[0] instanceof Closure) {
            declared = arguments[0]
            return null
        }
        arguments[0].all.eachWithIndex { item, number -> execute(item, arguments[1..-1], number) }
    }

    def execute(List item, List others, int number) {
        def file = new Staged(file: item[1])
        def task = new Task(values: [name: item[0], volume: file, options: others[0], suffix: others[1], params: params])
        declared.delegate = task
        declared.resolveStrategy = Closure.DELEGATE_FIRST
        def script = declared().toString()
        def work = new File("work/$number")
        work.mkdirs()
        java.nio.file.Files.createSymbolicLink(work.toPath().resolve(file.file.name), file.file.canonicalFile.toPath())
        def shell = new ProcessBuilder('bash', '-ue', '-c', script).directory(work).inheritIO().start()
        if (shell.waitFor() != 0) error("Process terminated with an error: $script")
        task.outputs.each { output, how ->
            def found = how.glob == false ? [new File(work, output)] : Glob.files(work, output)
            found = found.findAll { it.exists() && it.name != file.file.name }
            if (!found && !how.optional) error("Missing output file(s) `$output`")
            new File(task.folder).mkdirs()
            found.each { new File(task.folder, it.name).bytes = it.bytes }
        }
    }
}

def given = [:]
def words = args.drop(1).collectMany { it.startsWith('--') && it.contains('=') ? it.split('=', 2) as List : [it] }
words.eachWithIndex { word, at ->
    if (!word.startsWith('--')) return
    def value = at + 1 < words.size() && !words[at + 1].startsWith('--') ? words[at + 1] : true
    // As since version 24.10.
    given[word.substring(2).replaceAll(/-([a-z])/) { it[1].toUpperCase() }] = value
}
def text = new File(args[0]).text
// The strict syntax has declarations only.
def other = text.readLines().find { it && !(it ==~ /(\s|\/\/|}|def \w+\(.*\) \{|process |workflow |params\.).*/) }
if (other) {
    System.err.println("a statement beside declarations: $other")
    System.exit(1)
}
def configuration = new org.codehaus.groovy.control.CompilerConfiguration(scriptBaseClass: Pipeline.name)
def params = new LinkedHashMap() { def put(key, value) { containsKey(key) ? null : super.put(key, value) } }
params.putAll(given)
try {
    new GroovyShell(this.class.classLoader, new Binding(params: params), configuration).evaluate(text)
} catch (Failure failure) {
    System.err.println(failure.message)
    System.exit(1)
}
