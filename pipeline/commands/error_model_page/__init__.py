"""Parts of the interactive error-model page, put together by `pipeline.commands.error_model`."""
