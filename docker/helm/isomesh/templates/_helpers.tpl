{{- define "isomesh.name" -}}
{{- .Release.Name | trunc 50 | trimSuffix "-" -}}
{{- end }}

{{/* Numbers of files are float64, which Helm writes as 1e+06 from a million on. */}}
{{- define "isomesh.text" -}}
{{- if and (kindIs "float64" .) (eq . (floor .)) }}{{ int64 . }}{{ else }}{{ . }}{{ end }}
{{- end }}

{{- define "isomesh.labels" -}}
app.kubernetes.io/name: isomesh
app.kubernetes.io/instance: {{ .Release.Name }}
{{- end }}
