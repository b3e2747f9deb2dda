/*
 * The whole FMU as one translation unit, so that nothing but FMI's functions has a name outside of it.
 * FMI's headers are the importer's. For a shared library, define {{ fmi }}_OVERRIDE_FUNCTION_PREFIX.
 */
#ifndef {{ fmi }}_OVERRIDE_FUNCTION_PREFIX
#define {{ fmi }}_FUNCTION_PREFIX {{ model }}_
#endif
#define MODEL_IDENTITY "{{ identity }}"

{{ includes }}
